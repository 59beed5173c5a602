/* SPDX-License-Identifier: Apache-2.0 */
#ifndef ZEPHYR_DEVICETREE_H
#define ZEPHYR_DEVICETREE_H

#define DT_CHOSEN(name) name
#define DT_ALIAS(name) name

#endif
