# SPDX-License-Identifier: Apache-2.0
"""The commands of the ground.

Example:

    $ ./fledge packets received.pcap --database craft.xml
"""
