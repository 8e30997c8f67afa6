# %% [markdown]
# # paper

# %%
import symrefine

print(symrefine.__version__)
