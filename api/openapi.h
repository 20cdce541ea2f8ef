#ifndef WELKIN_API_OPENAPI_H
#define WELKIN_API_OPENAPI_H

#include "api/api.h"

#include <cJSON.h>

/* Building an OpenAPI document as a cJSON tree. An addition that fails for want of memory gives
 * NULL, to which later ones add nothing; welkin_openapi_json() then returns NULL. */

cJSON *doc_item(cJSON *parent, const char *key, cJSON *item);
cJSON *doc_object(cJSON *parent, const char *key); /* parent an array: key NULL */
cJSON *doc_array(cJSON *parent, const char *key);
void doc_string(cJSON *parent, const char *key, const char *value);
void doc_number(cJSON *parent, const char *key, double value);
void doc_bool(cJSON *parent, const char *key, int value);
void doc_ref(cJSON *parent, const char *key, const char *pointer); /* {"$ref": "#/components/" pointer} */

/* components.parameters and components.schemas.Request, RadianceRequest: from the table of fields. */
void openapi_fields(cJSON *parameters, cJSON *schemas);
/* Every field as a reference, for an operation's list of parameters. */
void openapi_parameter_refs(cJSON *list);
/* Those that change the noise of clouds, and which slice. */
void openapi_noise_parameters(cJSON *list, const struct welkin_noise_info *table);
/* The other schemas, written by hand. */
void openapi_schemas(cJSON *schemas);

#endif
