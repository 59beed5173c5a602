# SPDX-License-Identifier: Apache-2.0
# Empty: the build of a project writes another, with the types of its world/, to be found before this one.
