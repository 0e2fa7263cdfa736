"""The gate: holds a release of many sequences to a policy, and certifies what was checked."""
