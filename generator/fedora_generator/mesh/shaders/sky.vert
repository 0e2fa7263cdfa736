// One triangle that covers the image, and the ray through each of its points.
uniform mat3 rays;  // from normalised device coordinates (x, y, 1) to directions in the world

out vec3 ray;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
    ray = rays * vec3(corner, 1.0);
}
