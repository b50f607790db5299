"""Read RS274/NGC: tokens, blocks, modal state, toolpath."""
