"""A subcommand of a plugin."""

import click


@click.command()
@click.option("--name", default="world")
def greet(name):
    """Say hello."""
    click.echo(f"hello {name}")
