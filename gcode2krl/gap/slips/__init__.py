"""Set-up slips, tested before everything else."""
