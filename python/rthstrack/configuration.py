"""Configurations under the name they had before they moved beside the virtual test."""

from rthstrack.virtual_test.configuration import (
    Configuration,
    configuration_from,
    read_configuration,
    to_table,
    virtual_test_from,
)

__all__ = ["Configuration", "configuration_from", "read_configuration", "to_table", "virtual_test_from"]
