"""Reading RS274/NGC, the language that LinuxCNC and its kin share: tokens, blocks, modal state, toolpath."""
