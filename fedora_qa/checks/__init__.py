"""The checks, one file each: checks/<subject>/<property>.py. ``fedora_qa/catalogue.py`` lists them in their order."""
