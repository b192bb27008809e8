"""Studies with people: design, orders, protocol, data on disk, analysis, and the pages of a study."""
