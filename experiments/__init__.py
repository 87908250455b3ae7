"""Everything that is shown: the demo, tables, figures, benchmarks."""
