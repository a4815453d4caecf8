"""What people look at: reports, the viewer, tables in a terminal, JSON."""
