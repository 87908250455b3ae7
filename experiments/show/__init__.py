"""Tables and figures of results files."""
