"""What a screen needs: sessions, choices, ports, a running sequence and later work, without a screen."""
