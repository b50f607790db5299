"""Report a fit: figures of circles and plane, maps, numbers."""
