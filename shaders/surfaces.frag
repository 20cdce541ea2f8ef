/* Which triangle a sample shows, counted from 1; compute looks up the rest (Burns & Hunt 2013). */
flat in uint triangle_number;
layout(location = 0) out uint triangle;

void main()
{
	triangle = triangle_number;
}
