# SPDX-License-Identifier: Apache-2.0
"""Shared by the tests of the pages: a browser, and pictures of all pages."""
