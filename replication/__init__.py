"""Three papers replicated claim by claim: campaigns, rules written before the results, verdicts and a page."""
