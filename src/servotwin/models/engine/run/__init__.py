"""The loop over `step`, of one servo and of lanes one by one, and what is read of its log."""
