"""Pages from templates."""

from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from semrl.report import wording


def render_page(template: str, *, package: str = "semrl.report", **values: Any) -> str:
    """Fill a template; return the page as HTML text.

    Parameters
    ----------
    template
        Its name; it extends ``base.html`` of this folder, which needs a ``title``.
    package
        In whose folder it lies.
    values
        What it speaks of. Text is escaped, and a missing value is an error.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, "."), PackageLoader("semrl.report", ".")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = wording.number
    return environment.get_template(template).render(values)
