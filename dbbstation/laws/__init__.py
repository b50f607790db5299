"""Laws of friction, play, loads, delay and memory, over columns of tables, drives, ports and struts."""
