"""Laws over columns of tables, drives, simulators' ports and hexapods' struts."""
