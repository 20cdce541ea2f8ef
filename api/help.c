#include "api/value.h"

static const char *type_name(enum welkin_type type)
{
	switch (type) {
	case WELKIN_TYPE_DOUBLE:
		return "number";
	case WELKIN_TYPE_INT:
	case WELKIN_TYPE_SEED:
		return "whole number";
	case WELKIN_TYPE_BOOL:
		return "switch";
	case WELKIN_TYPE_ENUM:
	case WELKIN_TYPE_NAME:
		return "name";
	case WELKIN_TYPE_FLAGS:
		return "names";
	case WELKIN_TYPE_VEC3:
		return "vector";
	case WELKIN_TYPE_TRIPLE:
		return "number or triple";
	case WELKIN_TYPE_TIME:
		break;
	}
	return "time";
}

char *welkin_fields_help(void)
{
	struct text text = { 0 };
	for (int i = 0; i < welkin_field_count; i++) {
		const struct welkin_field *f = &welkin_fields[i];
		char allowed[400];
		value_allowed(f, allowed, sizeof allowed);
		text_printf(&text, "  %-37s %s, %s", f->name, type_name(f->type), allowed);
		if (f->default_text[0])
			text_printf(&text, " [%s]", f->default_text);
		text_printf(&text, ". %s\n", f->help);
	}
	return text_take(&text);
}
