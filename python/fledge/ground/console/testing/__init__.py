# SPDX-License-Identifier: Apache-2.0
"""What tests of the pages share: a browser, and pictures of all pages."""
