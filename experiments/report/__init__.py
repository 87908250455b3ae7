"""The report: our figures beside the paper's."""
