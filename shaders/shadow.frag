/* Depth alone. */
void main()
{
}
