"""What measures: one module a question, most with `Case` and `run` for `symrefine run`, or with a `main`."""
