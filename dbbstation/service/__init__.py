"""What a screen needs of a running station: it runs, its events become a state that can be drawn, nothing of it knows a screen."""
