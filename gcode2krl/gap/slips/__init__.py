"""Set-up slips, tested before everything else, a file a kind of slip; `order` says which comes when."""
