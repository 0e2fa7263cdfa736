// Optical frame: X right, Y down, Z forward. Row 0 of the image is row 0 of the framebuffer.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 texcoord;

uniform mat3 R_camera_world;
uniform vec3 camera_m;
uniform vec4 pinhole;  // fx, fy, cx, cy as fractions of half the image, the centre from the middle
uniform float near_m;

invariant gl_Position;

out vec3 point_m;
out vec3 facing;
out vec2 uv;

void main() {
    // Subtracting first keeps the digits of what is near, wherever in the world that is.
    vec3 p = R_camera_world * (position - camera_m);
    // Reversed, without a far plane: the depth buffer holds near_m / z, whose relative error does not grow with z.
    gl_Position = vec4(pinhole.xy * p.xy + pinhole.zw * p.z, near_m, p.z);
    point_m = position;
    facing = normal;
    uv = texcoord;
}
