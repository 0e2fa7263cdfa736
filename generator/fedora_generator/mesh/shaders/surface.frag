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

// Mean of the texture over the fragment: PROBES along the longer side of its footprint, each as wide as the shorter
// side, or as its share of the longer. Their number is fixed: one that followed the footprint would make steps in time.
vec3 mean_reflectance() {
    vec2 size = vec2(textureSize(reflectance, 0));
    vec2 across = dFdx(uv), down = dFdy(uv);
    float across_texels = length(across * size), down_texels = length(down * size);
    bool is_wide = across_texels > down_texels;
    vec2 longer = is_wide ? across : down;
    float longest = max(across_texels, down_texels), shortest = min(across_texels, down_texels);
    float level = log2(max(max(shortest, longest / float(PROBES)), 1e-6));
    vec3 total = vec3(0.0);
    for (int i = 0; i < PROBES; ++i) {
        total += textureLod(reflectance, uv + longer * ((float(i) + 0.5) / float(PROBES) - 0.5), level).rgb;
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
