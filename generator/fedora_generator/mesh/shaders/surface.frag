// Lambert's law in linear light. It knows no direction of view, so that brightness is constant along the flow.
in vec3 point_m;
in vec3 facing;
in vec2 uv;

uniform sampler2D reflectance;
uniform vec3 emission;
uniform float ambient;
uniform vec3 sun;             // to the sun, times its strength
uniform vec4 lamps[LAMPS];    // position, strength
uniform float lamp_radius_m;
uniform float gamma;          // 1 keeps linear light

out vec4 radiance;

// Four probes spread over the fragment so that along each side they are a quarter apart, like rooks on a board.
const int PROBES = 4;
const vec2 ROOKS[PROBES] =
    vec2[](vec2(-0.375, -0.125), vec2(-0.125, 0.375), vec2(0.125, -0.375), vec2(0.375, 0.125));

// Mean of the texture over the fragment's footprint. Each probe is as wide as its share: of the area where the surface
// is seen from the front, of the longer side where it is seen from the side. Number and places follow nothing, so that
// smooth motion never makes a step.
vec3 mean_reflectance() {
    vec2 size = vec2(textureSize(reflectance, 0));
    vec2 across = dFdx(uv), down = dFdy(uv);
    float area = abs(determinant(mat2(across * size, down * size)));
    float longest = max(length(across * size), length(down * size));
    float level = log2(max(max(sqrt(area / float(PROBES)), longest / float(PROBES)), 1e-6));
    vec3 total = vec3(0.0);
    for (int i = 0; i < PROBES; ++i) {
        total += textureLod(reflectance, uv + ROOKS[i].x * across + ROOKS[i].y * down, level).rgb;
    }
    return total / float(PROBES);
}

void main() {
    vec3 n = normalize(gl_FrontFacing ? facing : -facing);
    float irradiance = ambient + max(dot(n, sun), 0.0);
    for (int i = 0; i < LAMP_COUNT; ++i) {
        vec3 to_lamp = lamps[i].xyz - point_m;
        float squared = dot(to_lamp, to_lamp) + lamp_radius_m * lamp_radius_m;
        irradiance += lamps[i].w * max(dot(n, to_lamp), 0.0) * inversesqrt(squared) / squared;
    }
    vec3 linear = emission + irradiance * mean_reflectance();
    radiance = vec4(gamma == 1.0 ? linear : pow(clamp(linear, 0.0, 1.0), vec3(1.0 / gamma)), 1.0);
}
