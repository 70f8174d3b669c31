"""What the reference makes of docstrings: examples without a heading of their own get one."""

import griffe

HEADING = "Examples\n--------\n"


class Examples(griffe.Extension):
    """Set a heading above the first example, so that it is no part of what stands before."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        """Change the text of one docstring."""
        if obj.docstring and HEADING not in obj.docstring.value:
            before, prompt, after = obj.docstring.value.partition(">>> ")
            if prompt:
                obj.docstring.value = f"{before}{HEADING}{prompt}{after}"
