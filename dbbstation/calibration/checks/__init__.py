"""Check fits against statements: plan, scatter, noise, physics."""
