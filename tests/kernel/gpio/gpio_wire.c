// SPDX-License-Identifier: GPL-2.0 OR MIT
/*
 * A GPIO chip with two lines that a wire joins: line 0 is driven, line 1 follows it and interrupts. For the rig, whose
 * kernel has neither gpio-sim nor gpio-mockup.
 */
#include <linux/gpio/driver.h>
#include <linux/interrupt.h>
#include <linux/irq_work.h>
#include <linux/module.h>

#define DRIVEN 0
#define FOLLOWS 1
#define LINES 2

static struct gpio_chip chip;
static bool level;
static unsigned int edges = IRQ_TYPE_NONE; /* that interrupt */
static bool enabled;
static struct irq_work follow;

/* In interrupt context, as the handlers expect. */
static void interrupt(struct irq_work *work) {
    generic_handle_domain_irq(chip.irq.domain, FOLLOWS);
}

static void set(struct gpio_chip *gc, unsigned int line, int value) {
    const bool changed = level != !!value;

    if (line != DRIVEN || !changed)
        return;
    level = value;
    if (enabled && (edges & (level ? IRQ_TYPE_EDGE_RISING : IRQ_TYPE_EDGE_FALLING)))
        irq_work_queue(&follow);
}
static int get(struct gpio_chip *gc, unsigned int line) {
    return level;
}
static int direction_output(struct gpio_chip *gc, unsigned int line, int value) {
    if (line != DRIVEN)
        return -EPERM;
    set(gc, line, value);
    return 0;
}
static int direction_input(struct gpio_chip *gc, unsigned int line) {
    return line == FOLLOWS ? 0 : -EPERM;
}
static int get_direction(struct gpio_chip *gc, unsigned int line) {
    return line == DRIVEN ? GPIO_LINE_DIRECTION_OUT : GPIO_LINE_DIRECTION_IN;
}

static int set_type(struct irq_data *d, unsigned int type) {
    if (type & ~IRQ_TYPE_EDGE_BOTH)
        return -EINVAL;
    edges = type;
    return 0;
}
static void mask(struct irq_data *d) {
    enabled = false;
    gpiochip_disable_irq(irq_data_get_irq_chip_data(d), irqd_to_hwirq(d));
}
static void unmask(struct irq_data *d) {
    gpiochip_enable_irq(irq_data_get_irq_chip_data(d), irqd_to_hwirq(d));
    enabled = true;
}
static const struct irq_chip wire_irq = {
    .name = "gpio-wire",
    .irq_mask = mask,
    .irq_unmask = unmask,
    .irq_set_type = set_type,
    .flags = IRQCHIP_IMMUTABLE,
    GPIOCHIP_IRQ_RESOURCE_HELPERS,
};

static struct gpio_chip chip = {
    .label = "gpio-wire",
    .owner = THIS_MODULE,
    .base = -1,
    .ngpio = LINES,
    .set = set,
    .get = get,
    .direction_output = direction_output,
    .direction_input = direction_input,
    .get_direction = get_direction,
};

static int __init start(void) {
    init_irq_work(&follow, interrupt);
    gpio_irq_chip_set_chip(&chip.irq, &wire_irq);
    chip.irq.default_type = IRQ_TYPE_NONE;
    chip.irq.handler = handle_simple_irq;
    return gpiochip_add_data(&chip, NULL);
}
static void __exit stop(void) {
    gpiochip_remove(&chip);
    irq_work_sync(&follow);
}
module_init(start);
module_exit(stop);
MODULE_LICENSE("Dual MIT/GPL");
MODULE_DESCRIPTION("Two GPIO lines joined by a wire");
