"""NC programs as text: reading, compensation, and writing in a control's dialect."""
