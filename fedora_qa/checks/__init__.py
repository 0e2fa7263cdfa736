"""The checks, one file each: checks/<subject>/<property>.py. ``fedora_qa/subjects/`` lists them in their order."""
