"""The gate: compares a release of many sequences with a policy, and certifies what was checked."""
