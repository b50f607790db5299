"""Sets of causes compared by their probability: the engine that is to judge every mismatch."""
