"""Laws over columns, which a table, a drive, a port of a simulator and the struts of a hexapod share."""
