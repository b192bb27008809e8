"""Computing times compared with alternatives: six groups of ratios, each measured within one run."""
