"""Results for other programs: `records` (JSON), `bop` (`models_info.json`), `files` (whole or absent)."""
