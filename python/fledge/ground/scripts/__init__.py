# SPDX-License-Identifier: Apache-2.0
"""A spacecraft for scripts of the ground, and its links (docs/ground.md)."""
