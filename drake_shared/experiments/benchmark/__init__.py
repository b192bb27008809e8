"""Computing times compared with alternatives: groups of ratios, each measured within one run."""
