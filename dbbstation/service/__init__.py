"""What a screen needs: sessions, choices and ports before, a running sequence and its state, work afterwards. Nothing of it knows a screen."""
