"""An ensemble of CNMPs: what its members disagree about is uncertain."""
