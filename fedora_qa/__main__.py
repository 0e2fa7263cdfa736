"""``python -m fedora_qa`` is the command ``fedora-qa``."""

from fedora_qa.cli.main import main

if __name__ == "__main__":
    main()
