// Nothing is coloured: the depth buffer is the result.
void main() {}
