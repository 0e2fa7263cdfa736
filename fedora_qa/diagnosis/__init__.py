"""From the features of failed measurements to causes; runs only after an alarm."""
