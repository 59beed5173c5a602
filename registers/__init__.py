# SPDX-License-Identifier: Apache-2.0
"""Boards of the register space: from one TOML file each to C tables, accessors and documents."""
