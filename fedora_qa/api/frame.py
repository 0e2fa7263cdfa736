"""A page within a notebook, isolated from it."""

from html import escape


def isolated_frame(page: str) -> str:
    """Return an HTML document in a frame whose scripts cannot reach the notebook."""
    return (
        # Sandboxed without ``allow-same-origin``: scripts of the report cannot reach the page of the notebook.
        f'<iframe srcdoc="{escape(page)}" sandbox="allow-scripts" title="fedora-qa report" '
        'style="width: 100%; height: 800px; border: 1px solid #8888"></iframe>'
    )
