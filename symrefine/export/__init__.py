"""Results for other programs: `records` (JSON), `bop` (`models_info.json`), `packages` (whole folders)."""
