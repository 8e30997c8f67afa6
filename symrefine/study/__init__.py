"""Studies: a YAML config and an experiment become one flat row for each run, tables, figures and recordings."""
