# SPDX-License-Identifier: Apache-2.0
"""Files of orbits and attitudes, as others write and read them."""
