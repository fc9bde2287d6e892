"""A live page: a run plays in the browser, shows what it sees, thinks and does, and a person may take part."""
