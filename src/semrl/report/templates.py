"""Pages from the templates of this folder."""

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from semrl.report import wording


def render_page(template: str, **values: Any) -> str:
    """Fill a template that lies beside this file; return the page as HTML text.

    Parameters
    ----------
    template
        Its name; it extends ``base.html``, which needs a ``title``.
    values
        What it speaks of. Text is escaped, and a missing value is an error.
    """
    environment = Environment(
        loader=PackageLoader("semrl.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = wording.number
    return environment.get_template(template).render(values)
