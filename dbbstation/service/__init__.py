"""Services for a screen: sessions, choices, ports, a running sequence and later work."""
