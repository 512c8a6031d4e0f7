"""Which model explains readings: fits, scores, noise, selection. Knows no test and no rig."""
