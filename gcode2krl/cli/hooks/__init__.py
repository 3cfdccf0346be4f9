"""What `install-hook` puts into CAM systems: files that run in their Python, not in ours."""
