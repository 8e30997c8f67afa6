"""Pictures: what there is to show of a detection, where to look from, and a small painter of its own."""
