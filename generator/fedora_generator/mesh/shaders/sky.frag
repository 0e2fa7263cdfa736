// The sky goes from horizon to zenith with the sine of the elevation.
in vec3 ray;

uniform vec3 horizon;
uniform vec3 zenith;
uniform float gamma;

out vec4 radiance;

void main() {
    vec3 linear = mix(horizon, zenith, max(normalize(ray).z, 0.0));
    radiance = vec4(gamma == 1.0 ? linear : pow(linear, vec3(1.0 / gamma)), 1.0);
}
