"""The commands of ``fedora-generate``: a file each, with arguments and help, which imports its work when it runs."""
