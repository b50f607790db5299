"""Services for a screen: sessions, choices, ports, the running sequence and the evaluation."""
